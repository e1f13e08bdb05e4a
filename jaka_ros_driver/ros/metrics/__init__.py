"""The driver's health for Prometheus, where ``~metrics_port`` is given.

endpoint     the endpoint as the node starts it; needs prometheus_client
figures      the figures themselves, read from what the client knows
page_server  the HTTP server of one page, whose clients cost it nothing
"""
