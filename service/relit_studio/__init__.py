"""Renders people and recordings whose truth is known. Development only: the service never imports it."""
