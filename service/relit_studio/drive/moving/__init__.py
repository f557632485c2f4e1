"""How near the moving relit person comes to the truth: what is rendered, what is shown, and a table of both."""
