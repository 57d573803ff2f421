/* The length walk (lcm_walk.h). A zeroed instance of the message struct stands in for the decoded one: scalar fields
 * are stored into it as they are read, so that the generated description answers with the counts of variable arrays.
 * Pointers in it stay NULL and are never followed. LCM's encoding is big-endian without padding. */
#include "lcmtypes/lcm_walk.h"
#include "palpate_contact_patch_t.h"

#include <stdint.h>
#include <string.h>

enum { WALK_STRUCT_MAX = 1024, WALK_DEPTH_MAX = 4 };

typedef struct walk {
    const uint8_t *bytes;
    size_t n_byte, at;
} walk;

const char *pal_walk_text(pal_walk result)
{
    static const char *const text[] = {
#define X(code, sentence) [PAL_WALK_##code] = sentence,
        PAL_WALK_TABLE(X)
#undef X
    };
    return (unsigned)result < PAL_WALK_COUNT ? text[result] : "unknown";
}

/* types that may stand inside another */
static const lcm_type_info_t *walk_nested(const char *name)
{
    const char *dot = strrchr(name, '.');
    if (dot) name = dot + 1;
    if (!strcmp(name, "contact_patch_t")) return palpate_contact_patch_t_get_type_info();
    return NULL;
}

static uint64_t walk_word(const uint8_t *bytes, size_t n)
{
    uint64_t word = 0;
    for (size_t i = 0; i < n; i++) word = word << 8 | bytes[i];
    return word;
}

static size_t walk_width(lcm_field_type_t type)
{
    switch (type) {
    case LCM_FIELD_INT8_T:
    case LCM_FIELD_BYTE:
    case LCM_FIELD_BOOLEAN:
        return 1;
    case LCM_FIELD_INT16_T:
        return 2;
    case LCM_FIELD_INT32_T:
    case LCM_FIELD_FLOAT:
        return 4;
    case LCM_FIELD_INT64_T:
    case LCM_FIELD_DOUBLE:
        return 8;
    default:
        return 0;
    }
}

/* exponent all ones: infinity or NaN */
static pal_walk walk_finite(const uint8_t *bytes, size_t count, size_t width)
{
    const uint64_t mask = width == 4 ? 0x7f800000u : 0x7ff0000000000000u;
    for (size_t i = 0; i < count; i++)
        if ((walk_word(bytes + i * width, width) & mask) == mask) return PAL_WALK_NAN;
    return PAL_WALK_OK;
}

/* scalar into the stand-in, where the description looks for counts */
static void walk_store(const lcm_field_t *field, const uint8_t *bytes)
{
    switch (field->type) {
    case LCM_FIELD_INT8_T:
    case LCM_FIELD_BOOLEAN:
        *(int8_t *)field->data = (int8_t)bytes[0];
        break;
    case LCM_FIELD_INT16_T:
        *(int16_t *)field->data = (int16_t)walk_word(bytes, 2);
        break;
    case LCM_FIELD_INT32_T:
        *(int32_t *)field->data = (int32_t)walk_word(bytes, 4);
        break;
    case LCM_FIELD_INT64_T:
        *(int64_t *)field->data = (int64_t)walk_word(bytes, 8);
        break;
    default:
        break;
    }
}

/* 32-bit length with its zero, then the characters */
static pal_walk walk_string(walk *w)
{
    if (w->n_byte - w->at < 4) return PAL_WALK_SHORT;
    const int32_t length = (int32_t)walk_word(w->bytes + w->at, 4);
    w->at += 4;
    if (length < 1) return PAL_WALK_STRING;
    if ((size_t)length > w->n_byte - w->at) return PAL_WALK_SHORT;
    const uint8_t *end = memchr(w->bytes + w->at, 0, (size_t)length);
    if (end != w->bytes + w->at + length - 1) return PAL_WALK_STRING;
    w->at += (size_t)length;
    return PAL_WALK_OK;
}

/* elements of an array over all its dimensions; 1 for a scalar */
static pal_walk walk_count(const walk *w, const lcm_field_t *field, size_t *count)
{
    *count = 1;
    for (int i = 0; i < field->num_dim; i++) {
        if (field->dim_size[i] < 0) return PAL_WALK_NUMBER;
        *count *= (size_t)field->dim_size[i];
        /* each element takes at least one byte */
        if (*count > w->n_byte - w->at) return PAL_WALK_SHORT;
    }
    return PAL_WALK_OK;
}

static pal_walk walk_struct(walk *w, const lcm_type_info_t *type, int depth);

static pal_walk walk_field(walk *w, const lcm_field_t *field, int depth)
{
    size_t count;
    pal_walk result = walk_count(w, field, &count);
    if (result) return result;
    if (field->type == LCM_FIELD_STRING) {
        for (size_t i = 0; i < count && !result; i++) result = walk_string(w);
        return result;
    }
    if (field->type == LCM_FIELD_USER_TYPE) {
        const lcm_type_info_t *nested = walk_nested(field->typestr);
        if (!nested) return PAL_WALK_SCHEMA;
        for (size_t i = 0; i < count && !result; i++) result = walk_struct(w, nested, depth + 1);
        return result;
    }
    const size_t width = walk_width(field->type);
    if (width == 0) return PAL_WALK_SCHEMA;
    if (count > (w->n_byte - w->at) / width) return PAL_WALK_SHORT;
    if (field->type == LCM_FIELD_FLOAT || field->type == LCM_FIELD_DOUBLE)
        result = walk_finite(w->bytes + w->at, count, width);
    if (field->num_dim == 0) walk_store(field, w->bytes + w->at);
    w->at += count * width;
    return result;
}

static pal_walk walk_struct(walk *w, const lcm_type_info_t *type, int depth)
{
    _Alignas(16) uint8_t instance[WALK_STRUCT_MAX] = {0};
    if (depth > WALK_DEPTH_MAX || (size_t)type->struct_size() > sizeof instance) return PAL_WALK_SCHEMA;
    for (int i = 0; i < type->num_fields(); i++) {
        lcm_field_t field;
        if (type->get_field(instance, i, &field)) return PAL_WALK_SCHEMA;
        pal_walk result = walk_field(w, &field, depth);
        if (result) return result;
    }
    return PAL_WALK_OK;
}

pal_walk pal_lcm_walk(const lcm_type_info_t *type, const void *bytes, size_t n_byte)
{
    walk w = {.bytes = bytes, .n_byte = n_byte};
    if (n_byte < 8) return PAL_WALK_SHORT;
    if (walk_word(w.bytes, 8) != (uint64_t)type->get_hash()) return PAL_WALK_TYPE;
    w.at = 8;
    pal_walk result = walk_struct(&w, type, 0);
    if (result) return result;
    return w.at == n_byte ? PAL_WALK_OK : PAL_WALK_LONG;
}
