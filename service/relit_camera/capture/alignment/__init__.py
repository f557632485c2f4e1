"""Aligning pictures of one face under different lights: rigid transforms, templates, picture sets, outliers."""
