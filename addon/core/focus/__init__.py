"""Focus: picks, moving subjects, and pulls between marks; the result is a `Focus`."""
