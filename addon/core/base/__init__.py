"""What every room stands on: errors, progress and cancelling, files that are whole, locks."""
