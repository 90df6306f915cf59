"""Names in exported code: what C99 and C++ take for an identifier and no header in use has taken already."""

import re
import unicodedata

from microrad.export.records import ExportError

LONGEST = 31
"""Characters that C99 tells apart in a name with external linkage (5.2.4.1)."""

_KEYWORDS = """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    alignas alignof and and_eq asm atomic_cancel atomic_commit atomic_noexcept bitand bitor bool catch char8_t char16_t
    char32_t class co_await co_return co_yield compl concept const_cast consteval constexpr constinit decltype delete
    dynamic_cast explicit export false friend mutable namespace new noexcept not not_eq nullptr operator or or_eq
    private protected public reflexpr reinterpret_cast requires static_assert static_cast synchronized template this
    thread_local throw true try typeid typename using virtual wchar_t xor xor_eq
    complex imaginary noreturn typeof typeof_unqual
"""

_MATHEMATICS = """
    acos asin atan atan2 cos sin tan acosh asinh atanh cosh sinh tanh exp exp2 expm1 frexp ilogb ldexp log log10 log1p
    log2 logb modf scalbn scalbln cbrt fabs hypot pow sqrt erf erfc lgamma tgamma ceil floor nearbyint rint lrint
    llrint round lround llround trunc fmod remainder remquo copysign nan nextafter nexttoward fdim fmax fmin fma
"""

_LIBRARY = """
    main fpclassify isfinite isinf isnan isnormal signbit isgreater isgreaterequal isless islessequal islessgreater
    isunordered j0 j1 jn y0 y1 yn gamma drem significand signgam
    FILE clearerr fclose feof ferror fflush fgetc fgetpos fgets fopen fprintf fputc fputs fread freopen fscanf fseek
    fsetpos ftell fwrite getc getchar gets perror printf putc putchar puts remove rename rewind scanf setbuf setvbuf
    snprintf sprintf sscanf stderr stdin stdout tmpfile tmpnam ungetc vfprintf vfscanf vprintf vscanf vsnprintf
    vsprintf vsscanf
    abort abs atexit atof atoi atol atoll bsearch calloc div exit free getenv labs ldiv llabs lldiv malloc mblen
    mbstowcs mbtowc qsort rand realloc srand strtod strtof strtol strtold strtoll strtoul strtoull system
    wcstombs wctomb
    memchr memcmp memcpy memmove memset strcat strchr strcmp strcoll strcpy strcspn strerror strlen strncat strncmp
    strncpy strpbrk strrchr strspn strstr strtok strxfrm
    errno assert offsetof clock time timespec tm clock_gettime
    linux unix i386
    state_of output_of
"""

_TAKEN = frozenset(_LIBRARY.split()) | {name + ending for name in _MATHEMATICS.split() for ending in ("", "f", "l")}


def identifier(name: str) -> str:
    """The name, if exported code can bear it: C99 and C++ keep it for users, and the headers in use have not taken it.

    It has letters, digits and underscores behind a letter, at most `LONGEST` of them.

    Raises:
        ExportError: For any other name, with the reason.
    """
    if trouble := _trouble(name):
        raise ExportError(f"{name!r} is no name for exported code: {trouble}; take for example {suggested(name)!r}")
    return name


def _trouble(name: str) -> str:
    """What speaks against a name; nothing where it can be borne."""
    checks = (
        (name.startswith("_"), "C keeps names that begin with an underscore for itself"),
        (
            not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name),
            "a name has letters from A to Z and a to z, digits and underscores, and begins with a letter",
        ),
        (
            len(name) > LONGEST,
            f"it has {len(name)} characters, and C compilers need not tell apart more than {LONGEST}",
        ),
        (name in _KEYWORDS.split(), "it is a keyword of C or C++"),
        (name in _TAKEN, "the C library, or the exported code itself, has that name"),
        ("__" in name, "C++ keeps names with two underscores in a row for itself"),
        (name.endswith("_t"), "POSIX keeps names that end in _t for its types"),
    )
    return next((words for found, words in checks if found), "")


def suggested(text: str) -> str:
    """An identifier that resembles a text: "PI + inverse in series" becomes "pi_inverse_in_series".

    Accents are dropped, what is too long is cut behind a word where that leaves half of it, and a name that is taken
    gets an ending. A text without letters and digits becomes "controller".
    """
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    found = "_".join(re.findall(r"[a-z0-9]+", plain)) or "controller"
    found, longest = found if found[0].isalpha() else f"c_{found}", LONGEST - len("_code")
    if len(found) > longest:
        whole = found[: longest + 1].rpartition("_")[0]
        found = whole if len(whole) >= longest // 2 else found[:longest]
    return f"{found}_code" if _trouble(found) else found
