"""The file formats of a laboratory, each as named channels (`source.Source`)."""
