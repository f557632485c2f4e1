"""The OpenAPI description of the REST API, as served and as written to a file, and what all operations share."""
