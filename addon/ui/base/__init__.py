"""Common code of operators and panels."""
