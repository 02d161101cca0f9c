"""Generated tables of the documents, a file for each subject."""
