"""What clients send and get, without HTTP: models.py what is sent, the views what is answered, job_json.py makes it."""
