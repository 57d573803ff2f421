#include "server/net/transport/host_name.h"

#include <arpa/inet.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

/* the name of "name", "name:port", "[address]" or "[address]:port", without brackets; false: it is none of them */
static bool name_of_host(const char *host, char *name, size_t cap)
{
    const bool v6 = *host == '[';
    const char *from = host + v6, *end = from + strcspn(from, v6 ? "]" : ":"), *port = end + (v6 && *end);
    if (end == from || (size_t)(end - from) >= cap || (v6 && !*end)) return false;
    memcpy(name, from, (size_t)(end - from));
    name[end - from] = 0;
    return *port == 0 || (*port == ':' && port[1] && !port[1 + strspn(port + 1, "0123456789")]);
}

/* is it one of "a,b,c"? */
static bool is_listed(const char *list, const char *name)
{
    const size_t n = strlen(name);
    for (const char *at = list; at && *at; at += strcspn(at, ","), at += *at == ',')
        if (strcspn(at, ",") == n && !strncasecmp(at, name, n)) return true;
    return false;
}

bool pal_address_is_loopback(const char *address)
{
    struct in_addr v4;
    if (!strncmp(address, "::ffff:", 7)) address += 7;
    return !address[0] || !strcmp(address, "::1") ||
           (inet_pton(AF_INET, address, &v4) == 1 && ntohl(v4.s_addr) >> 24 == 127);
}

bool pal_host_allowed(const char *host, bool remote, const char *hosts)
{
    static const char harmless[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_:[]";
    struct in_addr v4;
    struct in6_addr v6;
    char name[256], own[256] = "";
    if (!host[0] || host[strspn(host, harmless)] || !name_of_host(host, name, sizeof name)) return false;
    if (!strcasecmp(name, "localhost") || pal_address_is_loopback(name)) return true;
    if (!remote) return false;
    if (inet_pton(AF_INET, name, &v4) == 1 || inet_pton(AF_INET6, name, &v6) == 1 || is_listed(hosts, name))
        return true;
    return !gethostname(own, sizeof own - 1) && own[0] && !strcasecmp(name, own);
}

bool pal_origin_allowed(const char *origin, const char *host)
{
    const char *name = !strncmp(origin, "http://", 7) ? origin + 7 : !strncmp(origin, "https://", 8) ? origin + 8 : "";
    return !strcasecmp(name, host);
}
