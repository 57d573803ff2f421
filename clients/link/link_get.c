/* GET of one path over HTTP/1.1, for assets. */
#include "clients/link/link_core.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct link_get {
    link_get *next;
    pal_link_loop *loop;
    struct lws *wsi;
    pal_link_get_done done;
    void *user;
    size_t max;
    link_bytes body;
    int status;
};

/* tells the result once and frees; the connection may live a little longer without its object */
static void link_get_end(link_get *get, int status, const char *reason)
{
    link_get **place = &get->loop->gets;
    while (*place && *place != get) place = &(*place)->next;
    if (*place) *place = get->next;
    if (get->wsi) lws_set_opaque_user_data(get->wsi, NULL);
    get->done(get->user, status, status == 200 ? get->body.at : NULL, status == 200 ? get->body.n : 0, reason);
    free(get->body.at);
    free(get);
}

bool link_bytes_append(link_bytes *to, const void *bytes, size_t n_byte, size_t max)
{
    if (n_byte > max - to->n) return false;
    if (n_byte == 0) return true;
    if (to->n + n_byte > to->cap) {
        const size_t wanted = to->n + n_byte, cap = wanted > 2 * to->cap ? wanted : 2 * to->cap;
        uint8_t *grown = realloc(to->at, cap);
        if (!grown) return false;
        to->at = grown;
        to->cap = cap;
    }
    memcpy(to->at + to->n, bytes, n_byte);
    to->n += n_byte;
    return true;
}

static int link_get_read(struct lws *wsi)
{
    char buffer[LWS_PRE + 16384], *at = buffer + LWS_PRE;
    int n = (int)(sizeof buffer - LWS_PRE);
    return lws_http_client_read(wsi, &at, &n) < 0 ? -1 : 0;
}

int link_get_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len)
{
    (void)user;
    link_get *get = wsi ? lws_get_opaque_user_data(wsi) : NULL;
    if (!get) return reason == LWS_CALLBACK_RECEIVE_CLIENT_HTTP_READ ? -1 : 0;
    switch (reason) {
    case LWS_CALLBACK_ESTABLISHED_CLIENT_HTTP:
        get->status = (int)lws_http_client_http_response(wsi);
        break;
    case LWS_CALLBACK_RECEIVE_CLIENT_HTTP:
        return link_get_read(wsi);
    case LWS_CALLBACK_RECEIVE_CLIENT_HTTP_READ:
        if (link_bytes_append(&get->body, in, len, get->max)) break;
        link_get_end(get, 0, "answer is longer than allowed");
        return -1;
    case LWS_CALLBACK_COMPLETED_CLIENT_HTTP:
        link_get_end(get, get->status, get->status == 200 ? "" : "refused");
        break;
    case LWS_CALLBACK_CLIENT_CONNECTION_ERROR:
        get->wsi = NULL;
        link_get_end(get, 0, in ? in : "no connection");
        break;
    case LWS_CALLBACK_CLOSED_CLIENT_HTTP:
        get->wsi = NULL;
        link_get_end(get, 0, "connection closed before the end");
        break;
    default:
        break;
    }
    return 0;
}

pal_err pal_link_get(pal_link_loop *loop, const char *url, const char *path, size_t max, pal_link_get_done done,
                     void *user, pal_diagnostic *diag)
{
    link_address address;
    PAL_TRY(link_address_parse(url, &address, diag));
    link_get *get = calloc(1, sizeof *get);
    if (!get) return PAL_ERR_MEMORY;
    *get = (link_get){.next = loop->gets, .loop = loop, .done = done, .user = user, .max = max};
    loop->gets = get;
    /* the session's name, by which a proxy finds its server, as for the socket */
    char with_session[sizeof address.path + 256];
    const char *query = strchr(address.path, '?');
    snprintf(with_session, sizeof with_session, "%.255s%s", path, query ? query : "");
    struct lws_client_connect_info info = link_connect_info(loop, &address, LINK_LOCAL_GET, get, &get->wsi);
    info.origin = address.host;
    info.path = with_session;
    info.method = "GET";
    info.alpn = "http/1.1";
    /* on failure the callback has reported it */
    lws_client_connect_via_info(&info);
    return PAL_ERR_OK;
}

void link_get_free_all(pal_link_loop *loop)
{
    for (link_get *get = loop->gets, *next; get; get = next) {
        next = get->next;
        free(get->body.at);
        free(get);
    }
    loop->gets = NULL;
}
