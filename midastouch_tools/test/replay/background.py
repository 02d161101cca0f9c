"""Calls that wait, in threads of their own."""

import threading


def in_thread(function, *arguments):
    """Start it, and return what waits for its result."""
    result = []
    thread = threading.Thread(target=lambda: result.append(function(*arguments)), daemon=True)
    thread.start()

    def join(timeout=120.0):  # bounds a failing test only
        thread.join(timeout)
        return result[0] if result else "still waiting"

    return join
