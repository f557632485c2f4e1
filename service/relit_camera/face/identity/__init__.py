"""Who a face is: embeddings, and whether a followed face is a certain person's."""
