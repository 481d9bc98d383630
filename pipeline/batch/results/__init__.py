"""Queries over the results of a batch: lists, series, trends, SQL, exports."""
