/* GET of one path over HTTP/1.1, for assets. */
#include "clients/link/link_core.h"

#include <stdlib.h>
#include <string.h>

struct link_get {
    link_get *next;
    pal_link_loop *loop;
    struct lws *wsi;
    pal_link_get_done done;
    void *user;
    size_t max, n_byte, cap;
    uint8_t *bytes;
    int status;
};

/* tells the result once and frees; the connection may live a little longer without its object */
static void link_get_end(link_get *get, int status, const char *reason)
{
    link_get **place = &get->loop->gets;
    while (*place && *place != get) place = &(*place)->next;
    if (*place) *place = get->next;
    if (get->wsi) lws_set_opaque_user_data(get->wsi, NULL);
    get->done(get->user, status, status == 200 ? get->bytes : NULL, status == 200 ? get->n_byte : 0, reason);
    free(get->bytes);
    free(get);
}

/* grows by doubling, so memory follows what really came */
static bool link_get_append(link_get *get, const void *bytes, size_t n_byte)
{
    if (n_byte > get->max - get->n_byte) return false;
    if (get->n_byte + n_byte > get->cap) {
        size_t cap = get->cap ? get->cap : 65536;
        while (cap < get->n_byte + n_byte) cap *= 2;
        uint8_t *grown = realloc(get->bytes, cap);
        if (!grown) return false;
        get->bytes = grown;
        get->cap = cap;
    }
    memcpy(get->bytes + get->n_byte, bytes, n_byte);
    get->n_byte += n_byte;
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
        if (link_get_append(get, in, len)) break;
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
    get->loop = loop;
    get->done = done;
    get->user = user;
    get->max = max;
    get->next = loop->gets;
    loop->gets = get;
    struct lws_client_connect_info info = {0};
    info.context = loop->context;
    info.vhost = loop->vhost;
    info.address = address.host, info.host = address.host, info.origin = address.host;
    info.port = address.port;
    info.path = path;
    info.method = "GET";
    info.alpn = "http/1.1";
    info.local_protocol_name = LINK_LOCAL_GET;
    info.opaque_user_data = get;
    info.pwsi = &get->wsi;
    /* on failure the callback has reported it */
    lws_client_connect_via_info(&info);
    return PAL_ERR_OK;
}

void link_get_free_all(pal_link_loop *loop)
{
    for (link_get *get = loop->gets, *next; get; get = next) {
        next = get->next;
        free(get->bytes);
        free(get);
    }
    loop->gets = NULL;
}
