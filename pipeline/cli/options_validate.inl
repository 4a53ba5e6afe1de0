// The options of `validate`; a part of options.cpp, whose anonymous namespace it stands in.

constexpr const char* kValidateFooter =
    "PATH is a container, the folder of an asset, an archive of `patina pack`, a job file, a "
    "configuration of patinad, a\n"
    "scene (*.patina.json, .gltf, .glb), a baked scene (*.scene.json), bindings.json of `patina "
    "shader`, or a folder in\n"
    "which all of these are looked for (glTF files only if they are named). Paths in reports are "
    "relative. The same files\n"
    "give the same report for any number of jobs.\n"
    "\n"
    "Exit codes: 0 valid, 1 findings at or above --fail-on, 2 wrong usage, 3 something cannot be "
    "read, 130 interrupted.\n"
    "\n"
    "Examples:\n"
    "  patina validate baked\n"
    "  patina validate baked --format sarif --out patina.sarif --fail-on warning\n"
    "  patina validate baked/wall --against textures/wall\n"
    "  patina validate baked --inputs textures --severity PAT-1402=off --severity PAT-6002=error\n"
    "  patina validate baked --write-baseline known.json   # and from then on --baseline "
    "known.json";

void AddValidate(CLI::App* app, CommandLine* line) {
  CLI::App* command = app->add_subcommand(
      "validate", "Check containers, archives, jobs, scenes and configurations, for CI");
  ValidateArguments& o = line->validate;
  command->add_option("PATH", o.paths, "What to validate");
  command->add_option("--format", o.format, "text (default), json, junit or sarif")
      ->check(CLI::IsMember({"text", "json", "junit", "sarif"}));
  command
      ->add_option("-o,--out", o.out, "Write the report to this file, and a summary to the screen")
      ->type_name("FILE");
  command
      ->add_option("--fail-on", o.fail_on,
                   "The least severity that makes the exit code 1: error (default), warning, note")
      ->check(CLI::IsMember({"error", "warning", "note"}));
  command
      ->add_option("--severity", o.severities,
                   "Another severity for a code: error, warning, note or off; may be repeated")
      ->expected(1)
      ->take_all()
      ->type_name("CODE=SEVERITY");
  command
      ->add_option("--config", o.config,
                   "Severities and threshold from a file (schemas/validate-config.schema.json)")
      ->type_name("FILE.json");
  command->add_option("--baseline", o.baseline, "Accept the findings that this file lists")
      ->type_name("FILE.json");
  command
      ->add_option("--write-baseline", o.write_baseline,
                   "Accept all findings of now: write them to this file, and exit with 0")
      ->type_name("FILE.json");
  command
      ->add_option("--against", o.against,
                   "Measure the quality again, from the files, against this source (a folder of "
                   "maps, a folder of those, a BRDF or a job file), and compare it with what is "
                   "recorded: PSNR within 0.1 dB, errors of BRDFs within 1 %")
      ->type_name("SOURCE");
  command
      ->add_option("--inputs", o.inputs,
                   "Compare the hashes of the input files: DIR/<asset>/<file> or DIR/<file>")
      ->type_name("DIR");
  command->add_flag("--current", o.current_only,
                    "Of each asset only the revision that is `current`");
  command->add_flag("--list-codes", o.list_codes, "Print the catalogue of findings");
  command->add_option("-j,--jobs", line->threads, "Containers at a time (default: all CPUs)")
      ->check(CLI::Range(0, kMaxThreads))
      ->type_name("N");
  command->add_flag_callback(
      "-q,--quiet", [line] { line->verbosity = Verbosity::kQuiet; }, "No progress, no summary");
  command->footer(kValidateFooter);
  command->callback([line] { line->command = Command::kValidate; });
}
