// SPDX-License-Identifier: MIT
// Puts the followed lung into a Unity scene: add it to an object with a MeshFilter, name the basis
// file and the server of 'supine stream'. Unity's axes are left-handed, in metres, y up: a body that
// stands has left, back, head at -x, -z, y seen from the front.
using UnityEngine;
using UnityEngine.Rendering;

public class LungBehaviour : MonoBehaviour
{
    public string basisFile = "lungs.safetensors";
    public string host = "localhost";
    public int port = 18944;
    Supine.Basis basis;
    Supine.Link link;
    float[] xyz;
    Vector3[] positions;
    Mesh mesh;

    public static Vector3 ToUnity(float left, float back, float head)
    {
        return new Vector3(-1e-3f * left, 1e-3f * head, -1e-3f * back);
    }

    void Start()
    {
        basis = new Supine.Basis(basisFile);
        link = new Supine.Link(host, port);
        xyz = basis.Vertices();
        positions = new Vector3[basis.VertexCount];
        mesh = new Mesh();
        mesh.indexFormat = IndexFormat.UInt32;
        mesh.MarkDynamic();
        Show();
        mesh.triangles = basis.Triangles();
        mesh.RecalculateNormals();
        GetComponent<MeshFilter>().mesh = mesh;
    }

    void Update()
    {
        ulong stamp;
        float[] frame = link.TakeNewest(out stamp);
        if (frame == null) return;
        basis.Deform(frame, xyz);
        Show();
        mesh.RecalculateNormals();
    }

    void Show()
    {
        for (int i = 0; i < positions.Length; ++i)
            positions[i] = ToUnity(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
        mesh.vertices = positions;
    }

    void OnDestroy()
    {
        if (link != null) link.Dispose();
        if (basis != null) basis.Dispose();
    }
}
