/* Names by which a browser may come. A page of a stranger can have any name of its own lead here (DNS rebinding), but
 * no address and not this machine's own name. Thread: any. */
#ifndef PAL_NET_TRANSPORT_HOST_NAME_H
#define PAL_NET_TRANSPORT_HOST_NAME_H
#include <stdbool.h>

/* May a request have this `Host`? "name", "name:port", "[address]" or "[address]:port". remote: besides loopback names
 * also an IP address, this machine's name, and one of hosts, "a,b" */
bool pal_host_allowed(const char *host, bool remote, const char *hosts);
/* 127.0.0.0/8, ::1, their mapped forms, and "" */
bool pal_address_is_loopback(const char *address);
/* May a page of this `Origin` ask this `Host`? It must be that very host, by http or https */
bool pal_origin_allowed(const char *origin, const char *host);
#endif
