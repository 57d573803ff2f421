#include "clients/link/client_text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

void pal_client_print_json(cJSON *taken)
{
    char *text = cJSON_PrintUnformatted(taken);
    if (text) puts(text);
    fflush(stdout);
    cJSON_free(text);
    cJSON_Delete(taken);
}

bool pal_client_parse_vector(const char *text, double out[3])
{
    for (int i = 0; i < 3; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text || !isfinite(out[i]) || *end != (i < 2 ? ',' : 0)) return false;
        text = end + 1;
    }
    return true;
}
