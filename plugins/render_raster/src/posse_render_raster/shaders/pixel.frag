#version 330 core
// Averages the samples of each pixel, and takes the depth of the sample at its centre.
uniform sampler2D samples;
uniform int samples_per_axis;

layout(location = 0) out vec4 radiance_and_coverage;
layout(location = 1) out float z;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * samples_per_axis;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < samples_per_axis; ++i) {
        for (int j = 0; j < samples_per_axis; ++j) {
            vec4 s = texelFetch(samples, corner + ivec2(j, i), 0);
            sum += vec4(s.rgb, s.a > 0.0 ? 1.0 : 0.0);
        }
    }
    radiance_and_coverage = sum / float(samples_per_axis * samples_per_axis);
    z = texelFetch(samples, corner + samples_per_axis / 2, 0).a;
}
