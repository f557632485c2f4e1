"""Training the network by which instant capture knows how heads answer light."""
