"""Makes the data sheet of the project's documents: datasheet.py DOCS VERSION OUTPUT.pdf."""

import re
import sys
import tempfile
from pathlib import Path

import pypandoc
import typst

HERE = Path(__file__).parent
# The interface, when bundles issue, instructions and machines, clocks and resources.
CHAPTERS = ["hardware", "timing", "isa", "synthesis"]


def main():
    docs, version, output = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    text = (HERE / "datasheet.typ").read_text().replace("@VERSION@", version)
    for chapter in CHAPTERS:
        # The text has no labels of headings, because chapters may have equal labels, and no links to labels.
        body = pypandoc.convert_file(str(docs / f"{chapter}.md"), "typst", format="gfm-gfm_auto_identifiers")
        text += re.sub(r"#link\(<[^>]*>\)", "#text", body) + "\n"
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "datasheet.typ"
        source.write_text(text)
        (Path(folder) / "pictures").symlink_to((docs / "pictures").resolve())
        typst.compile(str(source), output=str(output), root=folder)


if __name__ == "__main__":
    main()
