"""Words, bytes, time, sockets and logs; imports nothing else of this project."""
