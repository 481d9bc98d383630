"""A wheel alignment machine under test, with known errors."""
