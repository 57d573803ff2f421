/* Text that the client programs write and read. Thread: [load]. */
#ifndef PAL_LINK_CLIENT_TEXT_H
#define PAL_LINK_CLIENT_TEXT_H
#include <cjson/cJSON.h>
#include <stdbool.h>

/* prints a tree as one line on stdout; takes it */
void pal_client_print_json(cJSON *taken);
/* three numbers "x,y,z"; false: malformed */
bool pal_client_parse_vector(const char *text, double out[3]);
#endif
