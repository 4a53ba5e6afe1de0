// The options of `view`; a part of options.cpp, whose anonymous namespace it stands in.

void AddView(CLI::App* app, CommandLine* line) {
  ViewArguments& o = line->view;
  CLI::App* command =
      app->add_subcommand("view", "Show a container in the browser: lit, map by map, mip by mip");
  command
      ->add_option("CONTAINER", o.container,
                   "A container, or the folder of an asset (its current container)")
      ->required();
  command
      ->add_option("--source", o.source,
                   "[maps] The maps it was baked from, a folder or a job file: to wipe over to "
                   "them, and to see the difference")
      ->type_name("DIR");
  command->add_option("--port", o.port, "Port on 127.0.0.1 (default: any that is free)")
      ->check(CLI::Range(0, 65535))
      ->type_name("N");
  command->add_flag("--no-browser", o.no_browser,
                    "Do not open a browser, only print the address");
  command->footer(
      "Serves the container to this machine alone until Ctrl-C. The address holds a token, new "
      "with every start; who has\n"
      "it sees the container. A browser that is opened shows its command line, and with it the "
      "token, to other users of\n"
      "this machine; with --no-browser only the terminal does. The page needs WebGL 2, as every "
      "browser has it; a dashboard\n"
      "(patinad --listen) has the same for every revision.\n"
      "\n"
      "Examples:\n"
      "  patina view baked/wall\n"
      "  patina view baked/wall --source textures/wall\n"
      "  patina view baked/chrome/r0001 --port 8080 --no-browser      # then: ssh -L "
      "8080:127.0.0.1:8080 machine");
  command->callback([line] { line->command = Command::kView; });
}
