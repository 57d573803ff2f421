/* A JSON tree as a table of members; one whose value is NULL is left out:
 *     PAL_JSON({"name", JSON_TEXT(name)}, {"size", PAL_JSON({"m", JSON_NUMBER(size_m)})})
 * Header only, so that the library of this room needs no cJSON. Thread: [any]. */
#ifndef PAL_BASE_JSON_MEMBERS_H
#define PAL_BASE_JSON_MEMBERS_H
#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

typedef struct pal_json_member {
    const char *key;
    cJSON *value; /* taken */
} pal_json_member;

/* adds members, which end with a key NULL; the result is object */
static inline cJSON *pal_json_add_members(cJSON *object, const pal_json_member *member)
{
    for (; member->key; member++)
        if (member->value) cJSON_AddItemToObject(object, member->key, member->value);
    return object;
}

/* writes the object to a file as one line, and takes it; false: it could not be made or written */
static inline bool pal_json_write(FILE *to, cJSON *object)
{
    char *text = object ? cJSON_PrintUnformatted(object) : NULL;
    bool good = text && fprintf(to, "%s\n", text) >= 0 && fflush(to) == 0;
    cJSON_free(text);
    cJSON_Delete(object);
    return good;
}

#define PAL_JSON_ADD(object, ...) pal_json_add_members(object, (const pal_json_member[]){__VA_ARGS__, {NULL, NULL}})
#define PAL_JSON(...)             PAL_JSON_ADD(cJSON_CreateObject(), __VA_ARGS__)
#define JSON_NUMBER(value)        cJSON_CreateNumber((double)(value))
#define JSON_BOOL(value)          cJSON_CreateBool(value)
#define JSON_TEXT(text)           cJSON_CreateString(text)
#endif
