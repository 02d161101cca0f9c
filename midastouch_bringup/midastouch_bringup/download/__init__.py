"""Public files, fetched so that a broken line, a full disk or a hostile archive leaves nothing wrong behind."""
