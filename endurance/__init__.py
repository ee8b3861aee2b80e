"""Long trials of the running system; not a part of the package, nor of the tests."""
