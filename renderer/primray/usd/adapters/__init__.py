"""One resolved prim in, description objects out. Adapters never look at parents or children and open no files."""
