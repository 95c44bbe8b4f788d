"""Headers that tell a browser how little it may do with an answer.

Scripts and styles come from this service alone, none may be inline, nothing may be evaluated, and
no page of another site may frame, embed or read anything.  A report is a document that carries its
own scripts, so it gets a policy of its own: it may run them in a sandbox, without a name, without
cookies and without a network.
"""

from __future__ import annotations

__all__ = ["FLEET_POLICY", "PAGE_POLICY", "REPORT_POLICY", "SECURITY_HEADERS", "STATIC_CACHE"]

PAGE_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data:",
        "connect-src 'self'",
        "form-action 'self'",
        "base-uri 'none'",
        "frame-ancestors 'none'",
    )
)

REPORT_POLICY = "; ".join(
    (
        "sandbox allow-scripts allow-downloads",
        "default-src 'none'",
        "script-src 'unsafe-inline'",
        "style-src 'unsafe-inline'",
        "img-src data:",
        "font-src data:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)

FLEET_POLICY = "; ".join(
    (
        "default-src 'none'",
        "style-src 'unsafe-inline'",
        "img-src data:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
"""For the fleet page, which runs no script and links to the pages of this service.

It stands in no sandbox: from one, a browser would follow a link without the caller's cookie.
"""

SECURITY_HEADERS = {
    "Content-Security-Policy": PAGE_POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
}
"""Sent with every answer that does not set its own."""

STATIC_CACHE = "no-cache"
"""Files of the page are asked for again each time and, unchanged, not sent again."""
