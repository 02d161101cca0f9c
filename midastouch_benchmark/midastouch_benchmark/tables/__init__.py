"""Tables of results and of the documents, from the reports of the repository."""
