"""Publication: results are packed into archives, and archives are brought to where others look."""
