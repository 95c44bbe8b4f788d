"""HTTP security headers that restrict what a browser may do with a response.

Scripts and styles must come from this service; inline code and eval are forbidden, and other sites
cannot frame, embed or read anything.  A report contains its own scripts and therefore has its own
policy: the scripts run in a sandbox without origin, cookies or network access.
"""

from __future__ import annotations

__all__ = [
    "FLEET_POLICY",
    "FRAMED",
    "PAGE_POLICY",
    "REPORT_POLICY",
    "SECURITY_HEADERS",
    "STATIC_CACHE",
]

PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'"
)

REPORT_POLICY = (
    "sandbox allow-scripts allow-downloads allow-popups allow-popups-to-escape-sandbox; "
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data:; font-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Policy of a report, which a page of this service frames to add the way back.

A link in the report itself would leave its sandbox, and the browser would send no cookie along.
Only the documentation needs no cookie: its links open outside of the sandbox, in a new tab.
"""

FLEET_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
"""Policy of the fleet page, which runs no scripts and links to pages of this service.

The page is not sandboxed: from a sandbox, a browser would follow a link without the cookie.
"""

FRAMED = {"Content-Security-Policy": REPORT_POLICY, "X-Frame-Options": "SAMEORIGIN"}

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

STATIC_CACHE = "no-cache"
"""Cache-Control of static files: revalidated on each use, resent only if changed."""
