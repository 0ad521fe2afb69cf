"""What clients send and get, without HTTP: models.py is what is sent, views.py what is answered, job_json.py
makes it; reference.py is the reference of all operations."""
