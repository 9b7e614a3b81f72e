"""The node web_node: what it receives while a page is open, and what it does on behalf of a page."""
