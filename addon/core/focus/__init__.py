"""What is in focus: picking, following what moves, pulling from mark to mark; a `Focus` value comes out."""
