// The options of `tradeoff`; a part of options.cpp, whose anonymous namespace it stands in.

void AddTradeoff(CLI::App* app, CommandLine* line) {
  CLI::App* command = app->add_subcommand(
      "tradeoff", "Bake inputs in many configurations: what accuracy costs in time and bytes");
  TradeoffOptions& o = line->tradeoff;
  command->add_option("INPUT", o.inputs, "As of `bake`: folders of maps, BRDF files, scenes")
      ->required();
  command->add_option("-o,--out", o.out, "Folder for the containers and the report")
      ->required()
      ->type_name("DIR");
  const auto words = [command](const char* name, std::vector<std::string>* list, const char* help,
                               std::vector<std::string> choices) {
    command->add_option(name, *list, help)->delimiter(',')->check(CLI::IsMember(choices));
  };
  words("--profiles", &o.profiles, "[maps] Sizes of the feature textures",
        {"bcf-0.5k", "bcf-1k", "bcf-2k", "bcf-2k++"});
  words("--qualities", &o.qualities, "How long to train", {"preview", "standard", "reference"});
  words("--recipes", &o.recipes, "How to train", {"patina", "paper"});
  const auto numbers = [command](const char* name, std::vector<int>* list, const char* help,
                                 int least, int most) {
    command->add_option(name, *list, help)->delimiter(',')->check(CLI::Range(least, most));
  };
  numbers("--nsides", &o.nsides, "[BRDFs] Resolutions of the grid", 1, kMaxJobNside);
  numbers("--index-bits", &o.index_bits, "[BRDFs] Codes in the codebook, as a power of two", 1,
          kMaxJobIndexBits);
  numbers("--widths", &o.hidden, "[BRDFs] Widths of the network", kMinJobHidden, kMaxJobHidden);
  numbers("--layers", &o.hidden_layers, "[BRDFs] Hidden layers of the network", 1,
          kMaxJobHiddenLayers);
  words("--interpolations", &o.interpolations, "[BRDFs] Between corners of the grid",
        {"bilinear", "inverse_distance", "uniform"});
  numbers("--shares", &o.shares, "[BRDFs] Materials on one codebook", 1, 64);
  command->add_option("--threads", line->threads, "Threads (default: all CPUs)")
      ->check(CLI::Range(0, kMaxThreads));
  AddCommon(command, line, false);
  command->footer(
      "Lists are separated by commas; every combination is baked. Without any: materials in four "
      "profiles and three\n"
      "qualities; BRDFs with the default, and with other values of each setting by itself. The "
      "network of materials is\n"
      "12-16-C always. DIR/runs has the containers; DIR/tradeoff.html, .csv and .json have the "
      "figures and three Pareto\n"
      "fronts: quality against encode time, bytes and decode time. Interrupted, the same command "
      "goes on where it was.\n"
      "Examples:\n"
      "  patina tradeoff textures/wall textures/floor --out sweep\n"
      "  patina tradeoff wall --out sweep --profiles bcf-0.5k,bcf-1k --qualities preview,standard\n"
      "  patina tradeoff merl/*.binary --out sweep --nsides 16,32 --widths 16,32,64");
  command->callback([line] { line->command = Command::kTradeoff; });
}
