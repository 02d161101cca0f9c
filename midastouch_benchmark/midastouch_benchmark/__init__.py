"""What measures MidasTouch; nothing that runs on a robot imports it."""
