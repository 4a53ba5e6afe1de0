#!/usr/bin/env python3
"""Shows every rule of lint.py a tree that breaks it, and one that does not."""

import os
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import lint  # noqa: E402

CLEAN = {
    "formats/a.h": "#pragma once\n#include <vector>\n",
    "formats/a.cpp": '#include "formats/a.h"\n#include <openssl/evp.h>\n',
    "pipeline/base/b.h": '#include "formats/a.h"\n',
    "pipeline/material/c.cpp": '#include "pipeline/base/b.h"\n// never throw here\nconst char* s = "throw";\n',
    "pipeline/image/d.h": '#include "pipeline/base/b.h"\n',
    "pipeline/cli/e.cpp": '#include "pipeline/image/d.h"\n#include <CLI/CLI.hpp>\n',
    "daemon/f.cpp": '#include "pipeline/image/d.h"\n',
    "tests/x_test.cpp": '#include "daemon/g.h"\n#include <OpenImageIO/imageio.h>\n',
    "daemon/g.h": "",
    "schemas/job.schema.json": '{"$schema": "http://json-schema.org/draft-07/schema#"}',
    "schemas/examples/invalid/broken.json": "{",
    "docs.md": "See ../shared/data, https://example.org/work/x and $HOME/work/y.\n",
}


class LintTest(unittest.TestCase):
    def findings(self, extra):
        with tempfile.TemporaryDirectory() as root:
            for path, content in {**CLEAN, **extra}.items():
                full = os.path.join(root, path)
                os.makedirs(os.path.dirname(full), exist_ok=True)
                with open(full, "wb") as file:
                    file.write(content if isinstance(content, bytes) else content.encode())
            found, files = lint.lint(root)
            self.assertGreaterEqual(files, len(CLEAN))
            return found

    def expect(self, rule, path, line, extra):
        """The tree with the extra files breaks this rule in this place, and no other."""
        self.assertEqual([(p, l, r) for p, l, r, _ in self.findings(extra)], [(path, line, rule)])

    def test_accepts_a_clean_tree(self):
        self.assertEqual(self.findings({}), [])

    def test_formats_may_not_include_pipeline(self):
        self.expect("include_direction", "formats/bad.cpp", 2, {"formats/bad.cpp": '\n#include "pipeline/base/b.h"\n'})

    def test_pipeline_may_not_include_daemon(self):
        self.expect("include_direction", "pipeline/jobs/bad.h", 1, {"pipeline/jobs/bad.h": '#include "daemon/g.h"\n'})

    def test_sources_may_not_include_tests(self):
        self.expect("include_direction", "formats/bad.h", 1,
                    {"formats/bad.h": '#include "tests/t.h"\n', "tests/t.h": ""})

    def test_a_module_may_not_include_a_higher_tier(self):
        self.expect("include_direction", "pipeline/base/bad.h", 1,
                    {"pipeline/base/bad.h": '#include "pipeline/image/d.h"\n'})

    def test_a_module_may_not_include_its_own_tier(self):
        self.expect("include_direction", "pipeline/metrics/bad.inl", 1,
                    {"pipeline/metrics/bad.inl": '  # include "pipeline/image/d.h"\n'})

    def test_a_module_needs_a_tier(self):
        self.expect("include_direction", "pipeline/novel/bad.h", 1,
                    {"pipeline/novel/bad.h": '#include "pipeline/base/b.h"\n'})

    def test_the_daemon_has_tiers_too(self):
        self.expect("include_direction", "daemon/base/bad.h", 1,
                    {"daemon/base/bad.h": '#include "daemon/queue/q.h"\n', "daemon/queue/q.h": ""})
        self.expect("include_direction", "daemon/api/bad.h", 1,
                    {"daemon/api/bad.h": '#include "daemon/watch/w.h"\n', "daemon/watch/w.h": ""})
        self.assertEqual(self.findings({"daemon/main.cpp": '#include "daemon/api/a.h"\n',
                                        "daemon/api/a.h": '#include "daemon/base/b.h"\n', "daemon/base/b.h": ""}), [])

    def test_includes_are_written_from_the_root(self):
        self.expect("include_direction", "formats/bad.cpp", 1, {"formats/bad.cpp": '#include "a.h"\n'})

    def test_heavy_headers_stay_out_of_headers(self):
        self.expect("heavy_headers", "pipeline/image/bad.h", 1,
                    {"pipeline/image/bad.h": "#include <OpenImageIO/imageio.h>\n"})

    def test_heavy_headers_have_one_user(self):
        self.expect("heavy_headers", "formats/z.cpp", 1, {"formats/z.cpp": "#include <openssl/sha.h>\n"})

    def test_headers_that_a_compiler_lacks(self):
        self.expect("missing_headers", "formats/bad.cpp", 1, {"formats/bad.cpp": "#include <format>\n"})

    def test_throw(self):
        self.expect("no_throw", "formats/bad.cpp", 2, {"formats/bad.cpp": "/* a\n*/ throw 1;\n"})

    def test_a_failed_allocation_may_throw(self):
        self.assertEqual(self.findings({"formats/ok.cpp": "throw std::bad_alloc();\n"}), [])

    def test_python_errors_may_be_raised(self):
        self.assertEqual(self.findings({"formats/ok.cpp": "throw py::value_error(text);\n"}), [])

    def test_sleep(self):
        self.expect("no_sleep_in_tests", "tests/bad_test.cpp", 1,
                    {"tests/bad_test.cpp": "std::this_thread::sleep_for(1s);\n"})

    def test_machine_paths(self):
        for top in ("wor" + "k", "roo" + "t", "hom" + "e"):
            self.expect("machine_paths", "notes.txt", 2, {"notes.txt": f"ok\nsee /{top}/someone/x\n"})
            self.expect("machine_paths", "notes.txt", 1, {"notes.txt": f'path="/{top}/x"\n'})

    def test_binary_files_are_not_text(self):
        self.assertEqual(self.findings({"tests/golden.bin": b"\0 /" + b"wor" + b"k/x"}), [])

    def test_unfinished(self):
        self.expect("unfinished", "notes.md", 1, {"notes.md": "TO" + "DO: write\n"})

    def test_file_length(self):
        self.assertEqual(self.findings({"formats/long.cpp": "\n" * lint.MAX_LINES}), [])
        self.expect("file_length", "formats/long.cpp", lint.MAX_LINES + 1,
                    {"formats/long.cpp": "\n" * (lint.MAX_LINES + 1)})

    def test_a_header_that_users_copy_is_one_file_included_by_its_name(self):
        self.assertEqual(self.findings({"formats/decoder/patina_decoder.h": "\n" * (lint.MAX_LINES + 1),
                                        "tests/copy_test.cpp": '#include "patina_decoder.h"\n'}), [])
        self.expect("include_direction", "formats/bad.cpp", 1, {"formats/decoder/patina_decoder.h": "",
                                                                "formats/bad.cpp": '#include "patina_decoder.h"\n'})
        self.assertEqual(self.findings({"formats/decoder/patina_brdf_decoder.h": '#include "patina_brdf_sampler.h"\n',
                                        "formats/decoder/patina_brdf_sampler.h": ""}), [])

    def test_schemas_that_are_not_json(self):
        self.expect("schemas_are_json", "schemas/a.json", 2, {"schemas/a.json": '{"a": 1,\n}'})

    def test_schemas_with_a_key_twice(self):
        self.expect("schemas_are_json", "schemas/a.json", 1, {"schemas/a.json": '{"a": 1, "a": 2}'})

    def test_schemas_of_another_draft(self):
        self.expect("schemas_are_json", "schemas/a.schema.json", 1,
                    {"schemas/a.schema.json": '{"$schema": "https://json-schema.org/draft/2020-12/schema"}'})

    def test_every_rule_is_shown_to_fail(self):
        with open(os.path.abspath(__file__), encoding="utf-8") as file:
            source = file.read()
        for rule in lint.RULES:
            self.assertIn(f'self.expect("{rule.__name__}"', source)


if __name__ == "__main__":
    unittest.main()
