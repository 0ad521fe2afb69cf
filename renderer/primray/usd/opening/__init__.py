"""Opening a stage: composed as asked, its metadata checked, its skeletons posed."""
