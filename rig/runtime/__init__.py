"""How tasks are run: as processes on the wall clock, or in one process in virtual time."""
