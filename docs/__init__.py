"""The pages, in Markdown; `docs.site` makes a site of them."""
