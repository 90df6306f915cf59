"""Who may ask the studio, under which name and from which page; what is believed of names, files and jobs."""
