#!/usr/bin/env python3
"""Tests of what shader_cost.py counts in a disassembled shader."""

import unittest

from shader_cost import count

MODULE = """
     %v4float = OpTypeVector %float 4
     %v2float = OpTypeVector %float 2
          %k = OpConstantComposite %v2float %one %one
       %main = OpFunction %void None %3
          %5 = OpLabel
          %8 = OpLoad %v4float %input
          %9 = OpLoad %type_sampled %texture
         %10 = OpImageSampleExplicitLod %v4float %9 %8 Lod %zero
         %11 = OpCompositeExtract %float %10 0
         %12 = OpFAdd %v4float %10 %8
         %13 = OpMatrixTimesVector %v4float %m %12
         %14 = OpExtInst %v2float %1 Sqrt %k
         %15 = OpFMul %float %11 %11
               OpSelectionMerge %20 None
               OpBranchConditional %yes %18 %20
               OpReturn
               OpFunctionEnd
"""


class Count(unittest.TestCase):
    def test_counts_components_within_functions(self):
        self.assertEqual(count(MODULE), {"arithmetic": 4 + 16 + 1, "functions": 2, "samples": 1, "loads": 1, "branches": 1})

    def test_refuses_loops(self):
        with self.assertRaises(ValueError):
            count(MODULE.replace("OpSelectionMerge", "OpLoopMerge"))


if __name__ == "__main__":
    unittest.main()
