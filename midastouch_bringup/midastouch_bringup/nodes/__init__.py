"""All nodes of the pipeline in one process."""
