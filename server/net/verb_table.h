/* All verbs of the message `command`, one line each. */
#ifndef PAL_NET_VERB_TABLE_H
#define PAL_NET_VERB_TABLE_H
#include "server/net/hub_verb.h"

extern const pal_verb pal_verb_table[]; /* [pal_verb_count] */
extern const int pal_verb_count;

/* formats the table as text, one line per verb with tab-separated name, permission, arguments and description; returns
 * the number of bytes of the whole text, as snprintf does. Thread: any */
int pal_verb_describe(const pal_verb *verb, int n_verb, char *text, size_t cap);
#endif
