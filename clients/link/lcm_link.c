#include "clients/link/lcm_link.h"
#include "clients/link/lcm_seal.h"
#include "server/base/clock.h"
#include "server/base/log.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <lcm/lcm.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { LCM_SUBSCRIPTIONS = 8, LCM_URL_BYTES = 256, LCM_RETRY_S = 5, LCM_BUFFER_WANTED = 4000000, LCM_QUEUE = 100 };
#define LCM_DEFAULT_GROUP "239.255.76.67:7667"

typedef struct lcm_subscriber {
    pal_lcm_link *link;
    char channel[PAL_LCM_CHANNEL_MAX + 1];
    const lcm_type_info_t *type;
} lcm_subscriber;

struct pal_lcm_link {
    pal_link_loop *loop;
    char url[LCM_URL_BYTES], prefix[PAL_LCM_PREFIX_MAX + 1];
    bool memory, warned;
    const pal_lcm_events *events;
    void *user;
    lcm_t *lcm;
    int n_subscriber;
    lcm_subscriber subscriber[LCM_SUBSCRIPTIONS];
    uint64_t source;
    int64_t sent_us; /* of the last message */
    bool is_keyed;
    pal_keys keys;
    pal_seal_senders senders;
    uint8_t *buffer; /* of publish [n_buffer] */
    int n_buffer;
};

/* is there a route to the group? connecting a datagram socket sends nothing and tells */
static bool lcm_route(const char *url)
{
    char host[64];
    const char *at = strstr(url, "://") + 3;
    const size_t n = strcspn(at, ":/?");
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(7667)};
    if (n == 0 || n >= sizeof host) return true;
    memcpy(host, at, n);
    host[n] = 0;
    if (inet_pton(AF_INET, host, &to.sin_addr) != 1) return true;
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0) return true;
    const bool reachable = connect(fd, (struct sockaddr *)&to, sizeof to) == 0 || errno != ENETUNREACH;
    close(fd);
    return reachable;
}

/* LCM asks the kernel for a buffer that a plain system cuts to 208 KiB */
static void lcm_check_buffer(void)
{
    FILE *file = fopen("/proc/sys/net/core/rmem_max", "r");
    long max = 0;
    if (!file) return;
    if (fscanf(file, "%ld", &max) == 1 && max < LCM_BUFFER_WANTED)
        pal_log(PAL_LOG_INFO, "lcm_buffer",
                "the kernel allows %ld bytes of receive buffer; bursts are lost less with `sysctl -w "
                "net.core.rmem_max=%d`",
                max, LCM_BUFFER_WANTED);
    fclose(file);
}

static int64_t unix_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static void lcm_received(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    lcm_subscriber *s = user;
    pal_lcm_link *link = s->link;
    size_t n_byte = buffer->data_size;
    uint64_t source = 0;
    if (link->events->wants && !link->events->wants(link->user, channel)) return;
    const pal_walk walk = pal_lcm_walk(s->type, buffer->data, pal_seal_begin(buffer->data, n_byte));
    /* its own come back from the bus */
    if (!walk && !link->memory && pal_seal_source(buffer->data, n_byte) == link->source) return;
    const char *reason = walk ? pal_walk_text(walk)
                              : pal_seal_admit(&link->senders, channel, buffer->data, &n_byte,
                                               link->is_keyed ? &link->keys : NULL, pal_clock_ns(), unix_us(), &source);
    if (!reason)
        link->events->message(link->user, channel, buffer->data, n_byte, source);
    else if (link->events->refused)
        link->events->refused(link->user, channel, reason);
}

static pal_err lcm_attach(pal_lcm_link *link, lcm_subscriber *s)
{
    lcm_subscription_t *subscription = lcm_subscribe(link->lcm, s->channel, lcm_received, s);
    if (!subscription) return PAL_ERR_MEMORY;
    lcm_subscription_set_queue_capacity(subscription, LCM_QUEUE);
    return PAL_ERR_OK;
}

static void lcm_readable(void *user)
{
    pal_lcm_link *link = user;
    /* one message a time: the loop comes again while there are more */
    lcm_handle_timeout(link->lcm, 0);
}

static bool lcm_try(pal_lcm_link *link)
{
    const bool route = link->memory || lcm_route(link->url);
    if (route) link->lcm = lcm_create(link->url);
    if (!link->lcm) {
        if (!link->warned && !route)
            pal_log(PAL_LOG_WARN, "lcm_route",
                    "no multicast route, LCM stays off (all else runs); add one with `ip route add 224.0.0.0/4 dev "
                    "lo` (or the rig's interface)");
        else if (!link->warned)
            pal_log(PAL_LOG_WARN, "lcm_open", "%s: LCM cannot be opened, it will be tried again", link->url);
        link->warned = true;
        return false;
    }
    for (int i = 0; i < link->n_subscriber; i++) lcm_attach(link, &link->subscriber[i]);
    if (link->loop) pal_link_poll_fd(link->loop, lcm_get_fileno(link->lcm), lcm_readable, link);
    return true;
}

static void lcm_retry(void *user)
{
    pal_lcm_link *link = user;
    if (!link->lcm && lcm_try(link)) pal_log(PAL_LOG_INFO, "lcm_open", "%s is open", link->url);
}

/* lcm:// is udpm://, with the default group when none is named, and a large receive buffer unless one is */
static pal_err lcm_url(char out[LCM_URL_BYTES], const char *url, bool *memory, pal_diagnostic *diag)
{
    const char *rest = NULL;
    *memory = !strcmp(url, "memq://");
    if (!strncmp(url, "lcm://", 6)) rest = url + 6;
    if (!strncmp(url, "udpm://", 7)) rest = url + 7;
    if (*memory) {
        strcpy(out, url);
        return PAL_ERR_OK;
    }
    if (!rest) return PAL_REFUSE(diag, "%s: not an lcm://, udpm:// or memq:// address", url);
    const size_t n_host = strcspn(rest, "?");
    char host[128];
    if (n_host >= sizeof host) return PAL_REFUSE(diag, "%s: too long", url);
    memcpy(host, rest, n_host);
    host[n_host] = 0;
    const char *options = rest[n_host] ? rest + n_host + 1 : "ttl=0";
    char buffer[40] = "";
    if (!strstr(options, "recv_buf_size")) snprintf(buffer, sizeof buffer, "&recv_buf_size=%d", LCM_BUFFER_WANTED);
    const int n = snprintf(out, LCM_URL_BYTES, "udpm://%s?%s%s", n_host ? host : LCM_DEFAULT_GROUP, options, buffer);
    return n < LCM_URL_BYTES ? PAL_ERR_OK : PAL_REFUSE(diag, "%s: too long", url);
}

/* no character of it has a meaning in the regular expressions of LCM but '.', and `wants` compares */
static pal_err set_prefix(pal_lcm_link *link, const char *prefix, pal_diagnostic *diag)
{
    size_t n = 0;
    if (!prefix) prefix = PAL_LCM_PREFIX;
    while (isalnum((unsigned char)prefix[n]) || (prefix[n] && strchr(".-_", prefix[n]))) n++;
    if (n == 0 || prefix[n] || n > PAL_LCM_PREFIX_MAX)
        return PAL_REFUSE(diag, "%.32s: a prefix of channels has 1 to %d letters, digits, '.', '-' or '_'", prefix,
                          PAL_LCM_PREFIX_MAX);
    memcpy(link->prefix, prefix, n + 1);
    return PAL_ERR_OK;
}

static pal_err use_keys(pal_lcm_link *link, const char *key_file, pal_diagnostic *diag)
{
    if (!key_file) key_file = getenv("PALPATE_LCM_KEY");
    if (!key_file || !*key_file) return PAL_ERR_OK;
    PAL_TRY(pal_key_file_read(key_file, &link->keys, diag));
    link->is_keyed = true;
    return PAL_ERR_OK;
}

pal_err pal_lcm_link_open(pal_link_loop *loop, const pal_lcm_options *options, const pal_lcm_events *events, void *user,
                          pal_diagnostic *diag, pal_lcm_link **out)
{
    pal_lcm_link *link = calloc(1, sizeof *link);
    if (!link) return PAL_ERR_MEMORY;
    *link = (pal_lcm_link){.events = events, .user = user};
    pal_err err = lcm_url(link->url, options->url, &link->memory, diag);
    if (!err) err = set_prefix(link, options->prefix, diag);
    if (!err) err = use_keys(link, options->key_file, diag);
    /* a memory queue belongs to its caller's own loop of calls */
    link->loop = link->memory ? NULL : loop;
    if (!err) err = pal_random_bytes(&link->source, sizeof link->source);
    if (!err && link->loop && !pal_link_add_timer(loop, LCM_RETRY_S * 1000000ull, lcm_retry, link))
        err = PAL_ERR_MEMORY;
    if (err) {
        pal_lcm_link_close(link);
        return err;
    }
    if (!link->memory) lcm_check_buffer();
    lcm_try(link);
    *out = link;
    return PAL_ERR_OK;
}

uint64_t pal_lcm_link_source(const pal_lcm_link *link)
{
    return link->source;
}

const char *pal_lcm_link_prefix(const pal_lcm_link *link)
{
    return link->prefix;
}

bool pal_lcm_link_is_keyed(const pal_lcm_link *link)
{
    return link->is_keyed;
}

void pal_lcm_link_close(pal_lcm_link *link)
{
    if (!link) return;
    if (link->lcm) lcm_destroy(link->lcm);
    free(link->buffer);
    free(link);
}

pal_err pal_lcm_link_subscribe(pal_lcm_link *link, const char *channel, const lcm_type_info_t *type)
{
    if (link->n_subscriber == LCM_SUBSCRIPTIONS) return PAL_ERR_FULL;
    lcm_subscriber *s = &link->subscriber[link->n_subscriber++];
    s->link = link;
    s->type = type;
    snprintf(s->channel, sizeof s->channel, "%s/%s", link->prefix, channel);
    return link->lcm ? lcm_attach(link, s) : PAL_ERR_OK;
}

pal_err pal_lcm_link_publish(pal_lcm_link *link, const char *session, const char *what, int n,
                             const lcm_type_info_t *type, const void *message)
{
    char channel[PAL_LCM_CHANNEL_MAX + 1];
    if (!link->lcm) return PAL_ERR_STATE;
    const int wanted = type->encoded_size(message);
    if (wanted < 0) return PAL_ERR_REFUSED;
    if (wanted + PAL_SEAL_BYTES > link->n_buffer) {
        uint8_t *grown = realloc(link->buffer, (size_t)wanted + PAL_SEAL_BYTES);
        if (!grown) return PAL_ERR_MEMORY;
        link->buffer = grown, link->n_buffer = wanted + PAL_SEAL_BYTES;
    }
    const int n_byte = type->encode(link->buffer, 0, wanted, message);
    if (n_byte < 0) return PAL_ERR_REFUSED;
    pal_lcm_channel(channel, link->prefix, session, what, n);
    const int64_t now_us = unix_us();
    link->sent_us = now_us > link->sent_us ? now_us : link->sent_us + 1;
    if (!pal_seal_put(link->buffer + n_byte, link->source, link->sent_us, channel, link->buffer, (size_t)n_byte,
                      link->is_keyed ? &link->keys.key[link->keys.n - 1] : NULL))
        return PAL_ERR_INTERNAL;
    return lcm_publish(link->lcm, channel, link->buffer, (unsigned)n_byte + PAL_SEAL_BYTES) == 0 ? PAL_ERR_OK
                                                                                                 : PAL_ERR_IO;
}

void pal_lcm_link_handle(pal_lcm_link *link)
{
    while (link->lcm && lcm_handle_timeout(link->lcm, 0) > 0) {
    }
}

void pal_lcm_channel(char channel[PAL_LCM_CHANNEL_MAX + 1], const char *prefix, const char *session, const char *what,
                     int n)
{
    char clean[32], number[16] = "";
    size_t k = 0;
    for (; session[k] && k < sizeof clean - 1; k++) {
        const char c = session[k];
        clean[k] = isalnum((unsigned char)c) || c == '.' || c == '-' ? c : '_';
    }
    clean[k] = 0;
    if (n >= 0) snprintf(number, sizeof number, "/%d", n);
    snprintf(channel, PAL_LCM_CHANNEL_MAX + 1, "%.12s/%s/%.12s%.6s", prefix, clean, what, number);
}

int pal_lcm_channel_index(const char *channel, const char *prefix, const char *session, const char *what)
{
    const char *slash = strrchr(channel, '/');
    if (!slash || !isdigit((unsigned char)slash[1]) || strlen(slash + 1) > 3) return -1;
    const int n = atoi(slash + 1);
    char wanted[PAL_LCM_CHANNEL_MAX + 1];
    pal_lcm_channel(wanted, prefix, session, what, n);
    return strcmp(wanted, channel) ? -1 : n;
}
