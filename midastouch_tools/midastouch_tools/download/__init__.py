"""Downloads of public files. A broken line, a full disk or a hostile archive leaves no wrong file."""
