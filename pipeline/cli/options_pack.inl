// The options of `pack` and `unpack-archive`; a part of options.cpp, whose anonymous namespace it
// stands in.

void AddPack(CLI::App* app, CommandLine* line) {
  PackArguments& o = line->pack;
  CLI::App* pack = app->add_subcommand("pack", "Write a container as one compressed file");
  pack->add_option("CONTAINER", o.container,
                   "A container, or the folder of an asset (its current container)")
      ->required();
  pack->add_option("-o,--out", o.out, "The archive to write; - is standard output")
      ->required()
      ->type_name("FILE.patina");
  pack->add_option(
          "--level", o.level,
          "Level of zstd, 1 (fast) to 19 (small); default " + std::to_string(kDefaultArchiveLevel))
      ->check(CLI::Range(1, 19))
      ->type_name("N");
  pack->add_flag_callback(
      "-q,--quiet", [line] { line->verbosity = Verbosity::kQuiet; }, "Do not print what was saved");
  pack->footer(
      "Prints what zstd saved on each file. The same container and level give the same bytes. "
      "Every "
      "file is checked\n"
      "against the manifest on the way; `patina validate` reads archives too, and `zstd -t` tests "
      "them.\n"
      "\n"
      "Examples:\n"
      "  patina pack baked/wall -o wall.patina\n"
      "  patina pack baked/wall -o - | ssh farm patina unpack-archive - -o baked/wall-from-here");
  pack->callback([line] { line->command = Command::kPack; });

  CLI::App* unpack =
      app->add_subcommand("unpack-archive", "Make a container of what `patina pack` wrote");
  unpack->add_option("FILE", o.archive, "The archive; - is standard input")->required();
  unpack->add_option("-o,--out", o.out, "Folder to make: the container")
      ->required()
      ->type_name("DIR");
  unpack
      ->add_option("--max-bytes", o.max_bytes,
                   "Unpack no more than this in all (default 17179869184: 16 GiB)")
      ->check(CLI::Range(uint64_t{1}, uint64_t{1} << 50))
      ->type_name("N");
  unpack->add_flag_callback(
      "-q,--quiet", [line] { line->verbosity = Verbosity::kQuiet; }, "Print nothing");
  unpack->footer(
      "DIR appears at once, when every file has been checked against the manifest, or not at all.\n"
      "\n"
      "Example:\n"
      "  patina unpack-archive wall.patina -o wall && patina info wall");
  unpack->callback([line] { line->command = Command::kUnpackArchive; });
}
