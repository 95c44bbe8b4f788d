// Words of a field with several values, as the command line would take them apart.

/** Parts of a text that are separated by blanks, semicolons, or commas with a blank behind. */
export function list(text) {
  return text.split(/[\s;]+|,\s+/).filter((part) => part !== "");
}

/** Known values; blanks may stand around their signs, as in "Kt25 = 0.048 ± 5 %, L = 2.9e-3". */
export function knownWords(text) {
  return list(text.trim().replace(/\s*(=|\+-|±)\s*/g, "$1").replace(/\s+%/g, "%"));
}
