"""Pictures and HTML, drawn in software: no display, no OpenGL."""
