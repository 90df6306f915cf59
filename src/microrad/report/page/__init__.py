"""What all pages share: templates, style, and the scripts that they carry."""
