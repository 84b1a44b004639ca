//! The page, with its script and its styles inside it.

/// The page as it is sent once.
pub(super) struct Page {
    /// Its text.
    pub html: String,
    /// What it may do: run the scripts and styles that carry its number, and speak to where it comes from. Nothing else is
    /// loaded from anywhere.
    pub policy: String,
}

/// The page, under a number that no other page carries.
pub(super) fn fresh() -> Page {
    let nonce = format!("{:032x}", rand::random::<u128>());
    let parts = [
        ("{{style}}", include_str!("page.css")),
        (
            "{{plot-style}}",
            include_str!("../report/vendor/uPlot.min.css"),
        ),
        (
            "{{licence}}",
            include_str!("../report/vendor/uPlot-LICENSE"),
        ),
        ("{{script}}", include_str!("page.js")),
        ("{{nonce}}", &nonce),
        // Last, as it may hold anything.
        (
            "{{plotter}}",
            include_str!("../report/vendor/uPlot.iife.min.js"),
        ),
    ];
    let html = parts.into_iter().fold(
        include_str!("page.html").to_owned(),
        |html, (name, text)| html.replace(name, text),
    );
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    );
    Page { html, policy }
}

#[cfg(test)]
mod tests {
    use super::fresh;

    #[test]
    fn nothing_is_left_to_fill_in_and_nothing_is_fetched() {
        let page = fresh();
        assert!(!page.html.contains("{{"));
        for outside in ["src=", "href=\"http", "@import", "url("] {
            assert!(!page.html.contains(outside), "{outside}");
        }
        let nonce = page
            .policy
            .split("'nonce-")
            .nth(1)
            .and_then(|n| n.split('\'').next());
        let nonce = nonce.expect("a number");
        assert_eq!(page.html.matches(&format!("nonce=\"{nonce}\"")).count(), 3);
        assert_ne!(page.policy, fresh().policy);
    }
}
