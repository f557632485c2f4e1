"""HTML reports of evaluations: the page template and the plots."""
