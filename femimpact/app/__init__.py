"""The application: study files, runs, results on disk, parameter studies, reports."""
