"""The schema's history: every form that the tables have had."""
