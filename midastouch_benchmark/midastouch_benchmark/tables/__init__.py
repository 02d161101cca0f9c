"""The tables of the documents, from the reports of the repository."""
