"""HTTP: who is answered, uploads, jobs in processes of their own."""
