/* Words and numbers of text files, line by line. Only for the readers of this room.
 *
 * Lines end with LF, CR or CR LF. Numbers are exact (correctly rounded) and do not depend on the locale. The bytes are
 * untrusted and need no terminator. Thread: any. */
#ifndef PAL_MESH_FILES_TEXT_SCAN_H
#define PAL_MESH_FILES_TEXT_SCAN_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct pal_text_scan {
    const uint8_t *at, *end;
    int64_t line; /* of at, from 1                                               */
    bool hash;    /* '#' begins a comment that runs to the line's end            */
    bool joins;   /* a backslash before the line's end joins the next line to it */
} pal_text_scan;

/* true when the line has another word; at is then on its first byte */
bool pal_text_more(pal_text_scan *scan);
/* skips the rest of this line; false when no line follows */
bool pal_text_next_line(pal_text_scan *scan);
/* the next word, on a later line if need be; false at the end of the file */
bool pal_text_seek(pal_text_scan *scan);
/* takes a word of this line: its length, 0 for none; its first byte was at */
size_t pal_text_word(pal_text_scan *scan);
/* takes the word and compares it without regard to case; the scan stays when it is another word */
bool pal_text_is(pal_text_scan *scan, const char *word);
/* take a number; false, and the scan stays, when the next word of this line is none ("nan" and "inf" are numbers) */
bool pal_text_double(pal_text_scan *scan, double *out);
bool pal_text_int(pal_text_scan *scan, int64_t *out);
/* the word at the scan for a message: printable, cut to 24 characters, "nothing" at the end of a line */
typedef struct pal_text_excerpt {
    char text[32];
} pal_text_excerpt;
pal_text_excerpt pal_text_excerpt_at(const pal_text_scan *scan);
#endif
