/* Members of a session: their roles, and which of them holds which tool. A plain table without locks, owned by the
 * hub. A tool has one holder, hence one writer. Type names differ from those of protocol/control.h, which server/net
 * also includes. Thread: [net]. */
#ifndef PAL_SESSION_MEMBERS_H
#define PAL_SESSION_MEMBERS_H
#include "server/sim/core/tools.h"

enum {
    PAL_MEMBER_LIST_MAX = 64,
    PAL_MEMBER_NAME = 48,
    PAL_MEMBER_ID_MAX = 32767, /* those above are for who only watches */
    PAL_MEMBER_INSTRUCTORS = 4 /* places kept for them (test_members) */
};

typedef enum pal_member_role { PAL_MEMBER_VIEWER, PAL_MEMBER_TRAINEE, PAL_MEMBER_INSTRUCTOR } pal_member_role;

typedef struct pal_member_entry {
    int id; /* 1 .. PAL_MEMBER_ID_MAX, never that of another member; 0: free entry */
    pal_member_role role;
    char name[PAL_MEMBER_NAME]; /* UTF-8, control characters removed; made unique by a number, also where
                                 * another only looks the same */
    int tool;                   /* index of the tool that the member holds; -1: none */
    uint32_t rights;            /* of a trainee: bits of what an instructor lets it do */
    bool muted;                 /* may do nothing but watch */
} pal_member_entry;

typedef struct pal_member_list {
    int n_tool, next_id, n_member;
    int holder[PAL_TOOL_MAX];       /* member id, 0: free */
    bool tool_locked[PAL_TOOL_MAX]; /* only instructors may take it */
    bool locked;                    /* only instructors may join */
    uint32_t rights;                /* of trainees who join */
    pal_member_entry member[PAL_MEMBER_LIST_MAX];
} pal_member_list;

void pal_members_init(pal_member_list *members, int n_tool);
/* the name as members see it, unlike that of any of them */
void pal_members_name(const pal_member_list *members, const char *name, char unlike[PAL_MEMBER_NAME]);
/* FULL: no free entry, or only those that are kept for instructors; STATE: the session is locked */
pal_err pal_members_join(pal_member_list *members, pal_member_role role, const char *name, int *id);
void pal_members_leave(pal_member_list *members, int id); /* releases the member's tool */
pal_member_entry *pal_members_find(pal_member_list *members, int id);
/* tool -1: any free tool. STATE: another member holds it, it is locked, or none is free; REFUSED: a viewer, a muted
 * member, or no such tool.
 * Releases the tool held before. */
pal_err pal_members_take_tool(pal_member_list *members, int id, int tool, int *taken);
void pal_members_release_tool(pal_member_list *members, int id);
#endif
