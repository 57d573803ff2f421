// The address of this page where its session goes on after a `move`. Pure.

/**
 * @param {import("./control_table.js").Move} to @param {string} search of this page: what it shows stays
 * @param {string} ticket of this page, "": none
 */
export function movedAddress(to, search, ticket) {
    const url = new URL(to.address);
    const query = new URLSearchParams(search);
    query.set("session", to.session);
    url.search = query.toString();
    url.hash = to.ticket ?? ticket;
    return url;
}
