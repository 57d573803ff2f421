/* The fields of every control message, as tables: what control_codec.c reads and writes by. Private to it and
 * control_table.c. Thread: any. */
#ifndef PAL_PROTOCOL_CONTROL_TABLE_H
#define PAL_PROTOCOL_CONTROL_TABLE_H
#include "protocol/control.h"

#define FIXED ((size_t)-1)

typedef enum pal_control_field_type {
    U16, /* numbers that are not required are left out while they are 0 */
    U32,
    U64,
    F64,
    NUMBER_OR_NAN,  /* double; NaN: not known, and then it is left out */
    BOOL,           /* not required: left out while it is false        */
    TEXT,           /* char[size]                                      */
    TEXT_OR_EMPTY,  /* the same, left out while it is empty            */
    ROLE,           /* pal_wire_role as its name                       */
    TOOL,           /* int: index, -1 any, none as null or absent      */
    NUMBERS,        /* double[max], counted or FIXED; counted and not required: left out while there is none */
    TEXTS,          /* char[max][size], counted */
    TEXTS_OR_EMPTY, /* the same, left out while there is none */
    OBJECT,         /* sub, whose offsets are those of the outer struct */
    OBJECTS,        /* struct[max] of size bytes, counted; not required: left out while there is none */
    ARGS            /* object of numbers: pal_wire_arg[max], counted   */
} pal_control_field_type;

typedef struct pal_control_field {
    const char *key; /* NULL ends a table */
    pal_control_field_type type;
    bool required;
    size_t offset, size;
    size_t count; /* offset of the uint32_t count, or FIXED */
    uint32_t max;
    const struct pal_control_field *sub;
} pal_control_field;

typedef struct pal_control_message {
    const char *name;
    bool from_server;
    const pal_control_field *fields;
} pal_control_message;
extern const pal_control_message pal_control_message_table[PAL_CONTROL_COUNT];
#endif
